"""What one rock looks like: shapes, user meshes, convex parts, levels of detail, texture."""

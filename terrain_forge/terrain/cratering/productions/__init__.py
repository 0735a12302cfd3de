"""Laws of how many craters are seen, a module each; the layer of craters finds them."""

"""How a rock lies on the ground: its outline, burial, contact."""

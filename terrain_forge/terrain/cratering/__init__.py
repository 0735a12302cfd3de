"""Impact craters: how many there are, what they look like fresh and worn, and where they lie."""

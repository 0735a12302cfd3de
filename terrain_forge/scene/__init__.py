"""One ray scene of ground and instanced rocks, for pictures, checks and later sensors."""

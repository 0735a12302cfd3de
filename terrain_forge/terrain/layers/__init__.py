"""The displacement layers, one module each; every public Layer class in here is a kind of layer."""

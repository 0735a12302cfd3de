"""The conformance test: every export through the programs that read its format, measured alike."""

"""File writers that exporters and truth share."""

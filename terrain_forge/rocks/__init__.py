"""Rocks: size laws, shapes, collision parts, where they lie and how they rest."""

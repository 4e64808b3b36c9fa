"""The minimum of the energy of a model is found here."""

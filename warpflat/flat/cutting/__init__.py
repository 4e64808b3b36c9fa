"""Pieces are cut where the strain energy stays: candidates, ledger, remedies."""

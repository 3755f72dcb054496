"""Random slopes with a known factor of safety."""

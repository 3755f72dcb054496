"""Monitoring of coupled runs: changes of state, collapse, mechanisms, the energy balance."""

"""Interior-point method for contact states: the central path of the complementarity problem."""

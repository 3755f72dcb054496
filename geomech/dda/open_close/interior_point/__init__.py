"""Contact states along the central path of the complementarity problem."""

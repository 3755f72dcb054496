"""Contact laws: penalty springs, joint stiffness, Coulomb friction, bonds, nonlinear laws."""

"""What contacts carry: penalty springs, joint stiffness, Coulomb friction, bonds, nonlinear laws."""

"""How a block moves and strains in a step: displacement matrix, simplex integration, mid-step configuration, Newmark's
schemes."""

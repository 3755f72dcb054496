"""From cracks back to blocks: the strain that crack opening and slip add to a block."""

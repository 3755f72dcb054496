"""Closed forms for blocks, joints and masonry."""

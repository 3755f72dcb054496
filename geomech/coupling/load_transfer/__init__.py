"""From contact forces on a block to boundary tractions and body forces on its elastic body."""

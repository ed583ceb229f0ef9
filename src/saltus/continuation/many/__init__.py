"""Many branches of one call: families, cascades of doublings, diagrams."""

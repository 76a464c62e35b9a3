"""(EgoState, ReferencePath) -> Command -> EgoState."""

"""How the ego follows its path at its speed, and how the car answers: (EgoState, ReferencePath) -> Command -> EgoState."""

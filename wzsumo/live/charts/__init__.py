"""Charts: sums of evidence that grow while traces speak for a change."""

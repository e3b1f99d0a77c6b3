"""Files on their way into a campaign: in one request, or in pieces (tus 1.0.0)."""

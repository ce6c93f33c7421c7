"""Small rigs, and what their cameras see."""

"""How effects are hidden: the truth of the trials. Nothing here comes from what looks for them."""

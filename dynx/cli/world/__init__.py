"""``dynx world``: a scene run by one engine or several."""

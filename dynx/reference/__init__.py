"""The backend `reference`: the algorithms of `dynx.rbd`, evaluated in float64."""

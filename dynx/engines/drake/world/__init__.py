"""Worlds in Drake: a scene as a discrete `MultibodyPlant` with a `SceneGraph`, stepped by Drake."""

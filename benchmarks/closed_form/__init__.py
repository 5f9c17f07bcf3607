"""All solutions of inverse kinematics in closed form, beside EAIK and ssik."""

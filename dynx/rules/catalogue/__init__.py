"""The rules, one module each: ``dx101_link_without_inertial.py`` defines the one subclass of `Rule` DX101."""

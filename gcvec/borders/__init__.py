"""Label map → borders at sub-pixel accuracy, shared by the regions on both sides."""

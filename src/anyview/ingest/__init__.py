"""Raw clips, whatever their container, to small even ones; what is refused, and why."""

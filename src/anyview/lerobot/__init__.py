"""LeRobotDataset v3.0, the format of shared demonstrations: episodes as clips, clips as episodes."""

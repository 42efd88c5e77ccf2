"""What GAIL and TPIL share."""

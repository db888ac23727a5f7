"""Ground sensing: the range sensor under the toe, and the ground profile that a swinging foot scans."""

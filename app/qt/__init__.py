"""The desktop: passive Qt views. The only folder that may import Qt."""

"""The received bytes on disk before anything else is done with them, and runs rebuilt from them."""

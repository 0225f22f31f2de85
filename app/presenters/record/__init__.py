"""The Record screen: live traces, what to do next, and the result at once."""

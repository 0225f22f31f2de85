"""A test report to sign, of one run or a campaign: what it says, and how it becomes PDF."""

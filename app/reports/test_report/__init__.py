"""Test report to sign, of one run or a campaign: content and typesetting as PDF."""

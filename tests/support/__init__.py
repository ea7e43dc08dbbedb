"""What test files share: problems, specs, and helpers to build, run and forge them."""

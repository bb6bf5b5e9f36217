"""What there is to see of runs: a page for the browser, pictures and plots."""

"""Control steps of densarm and its peers on one task."""

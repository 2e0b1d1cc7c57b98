"""Will a plan fail, where and why? Said before anything moves."""

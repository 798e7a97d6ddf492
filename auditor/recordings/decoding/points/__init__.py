"""How points lie in messages: layouts of clouds, and the types of drivers and transports."""

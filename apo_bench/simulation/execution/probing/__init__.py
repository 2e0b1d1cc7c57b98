"""What a robot does besides to know where it is: it squares, touches, lays flat, and believes."""

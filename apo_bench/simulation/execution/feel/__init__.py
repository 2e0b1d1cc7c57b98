"""What a robot does besides to know where it is: it squares, touches what is fixed, lays flat, and believes the rest."""

"""Role and scene of each frame of a card, proposed before anything is sent."""

"""What speaks for or against a result: findings from recording, shape, loads and innovations."""

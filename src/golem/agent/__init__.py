"""Who may drive the robot from outside by words: the skills as tools for programs and language models, under rules."""

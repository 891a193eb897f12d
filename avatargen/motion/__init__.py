"""How people move: a body's joint rotations over time, from built-in clips or from motion files."""

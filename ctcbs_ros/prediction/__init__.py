"""From the orbit to the end mass: tracking of the branch, margins, warnings."""

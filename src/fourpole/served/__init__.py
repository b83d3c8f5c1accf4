"""The app: campaigns served as pages on this machine, with the components of the report and the commands as actions."""

"""A machine without a link: a person moves it and says when it is there."""

"""The pages, a file each: a function `routes` gives the addresses of a page and what answers there."""

"""The commands of lidars, images and labels."""

"""Tracks of markers: how loud and how even their noise is, what spoils them, what gaps are bridged by."""

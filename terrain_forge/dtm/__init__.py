"""Reading digital terrain models and putting them onto the site's grid."""

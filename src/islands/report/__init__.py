"""Results for readers: JSON documents, sentences, figures and HTML pages."""

"""Compile the numerical code once, before processes that start together would each do it."""

from app.cli.doctor.compilation import compile_all

if __name__ == "__main__":
    compile_all()

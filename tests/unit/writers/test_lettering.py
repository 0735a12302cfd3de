"""Names of people's own choice in figures; a warning of matplotlib's is an error here."""

import warnings
from io import BytesIO

import pytest

from terrain_forge.truth.size_frequency_figure import population_label
from terrain_forge.writers import figure_text, file_name


def drawn(text):
    """The picture of a text, unless matplotlib complains."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4, 1))
    FigureCanvasAgg(figure)
    figure.text(0.1, 0.5, text)
    content = BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure.savefig(content)
    return content.getvalue()


@pytest.mark.parametrize("name", ["lose 石", "火星", "🚀 rocks", "a\x07b", "$x_$ and \\frac $"])
def test_no_name_makes_matplotlib_complain(name):
    assert drawn(figure_text(name))


def test_names_stay_what_they_are_where_the_font_has_them_and_apart_where_not():
    assert figure_text("Höhe Ω, ½ größer") == "Höhe Ω, ½ größer"
    assert figure_text("石") == file_name("石")
    assert figure_text("石") != figure_text("岩")


def test_a_name_is_in_legends_however_it_begins():
    from matplotlib.figure import Figure

    axes = Figure().add_subplot()
    axes.plot([0, 1], label=figure_text("_name"))
    assert [text.get_text().strip() for text in axes.legend().get_texts()] == ["_name"]


def test_the_size_frequency_figure_names_populations_so():
    part = {"count": {"observed": 1234}, "name": "石", "arrangement": "clustered"}
    assert population_label(part) == f"1 234 {file_name('石')}, clustered"

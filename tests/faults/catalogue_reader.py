"""Faults in the reader of descriptions and in the writer."""

from __future__ import annotations

from tests.faults.fault import Fault

JOINTS = "dynx.model.urdf.joints"
LINKS = "dynx.model.urdf.links"
VALUES = "dynx.model.urdf.values"
XML = "dynx.model.xml.reading"
XML_TEXT = "dynx.model.xml.text"
WRITER = "dynx.model.urdf.writer"
READER = "tests/model/urdf/test_reader.py"
REFUSALS = "tests/model/urdf/test_refusals.py"
REFUSED = f"{REFUSALS}::test_a_bad_description_is_refused_with_line_and_reason"

READER_FAULTS = (
    Fault(
        "document_type_accepted",
        XML,
        right="self._parser.StartDoctypeDeclHandler = self._doctype",
        wrong="self._parser.StartDoctypeDeclHandler = None",
        caught_by="tests/model/xml/test_reading.py::test_a_document_type_is_refused_with_its_line",
    ),
    Fault(
        "line_number_off_by_one",
        XML,
        right="element = Element(tag, attributes, line)",
        wrong="element = Element(tag, attributes, line - 1)",
        caught_by=f"{REFUSED}[zero axis]",
    ),
    Fault(
        "leading_blank_lines_not_counted",
        XML_TEXT,
        right=r'return stripped, len(re.findall(r"\r\n|\r|\n", front))',
        wrong="return stripped, 0 * len(front)",
        caught_by="tests/model/xml/test_reading.py::test_what_is_not_xml_is_refused_with_its_line",
    ),
    Fault(
        "byte_order_mark_kept",
        XML_TEXT,
        right='return "\\ufeff" + _strictly(data[len(mark) :], encoding, source), encoding',
        wrong="return _strictly(data, 'latin-1', source), 'latin-1'",
        caught_by=(
            "tests/model/xml/test_reading.py::test_text_is_read_by_its_mark_its_declaration_or_as_utf8"
        ),
    ),
    Fault(
        "decimal_comma_accepted",
        VALUES,
        right="word = word.strip()",
        wrong='word = word.strip().replace(",", ".")',
        caught_by=f"{REFUSED}[decimal comma]",
    ),
    Fault(
        "word_nan_accepted",
        VALUES,
        right="""        if _NUMBER.fullmatch(word):
            value = float(word)
            if math.isfinite(value):
                return value
""",
        wrong="""        try:
            return float(word)
        except ValueError:
            pass
""",
        caught_by=f"{REFUSED}[not a number]",
    ),
    Fault(
        "overflowing_number_accepted",
        VALUES,
        right="if math.isfinite(value):",
        wrong="if not math.isnan(value):",
        caught_by=f"{REFUSED}[overflow]",
    ),
    Fault(
        "position_and_attitude_exchanged",
        VALUES,
        right='return Pose(parts["xyz"], parts["rpy"])',
        wrong='return Pose(parts["rpy"], parts["xyz"])',
        caught_by=f"{READER}::test_everything_that_matters_is_read",
    ),
    Fault(
        "vector_of_four_cut_to_three",
        VALUES,
        right="if len(words) != 3:",
        wrong="words = words[:3]\n        if len(words) != 3:",
        caught_by=f"{REFUSED}[four numbers]",
    ),
    Fault(
        "zero_axis_accepted",
        JOINTS,
        right="if largest == 0.0:\n        raise reading.error(",
        wrong="if largest == 0.0:\n        return (1.0, 0.0, 0.0)\n        raise reading.error(",
        caught_by=f"{REFUSED}[zero axis]",
    ),
    Fault(
        "axis_not_scaled_to_one",
        JOINTS,
        right="return (x / norm, y / norm, z / norm)",
        wrong="return (x, y, z)",
        caught_by=f"{READER}::test_an_axis_of_any_length_becomes_a_unit_vector",
    ),
    Fault(
        "absent_axis_along_z",
        JOINTS,
        right="if axis is None:\n        return (1.0, 0.0, 0.0)",
        wrong="if axis is None:\n        return (0.0, 0.0, 1.0)",
        caught_by=f"{READER}::test_everything_that_matters_is_read",
    ),
    Fault(
        "missing_limit_accepted",
        JOINTS,
        right='if kind in ("revolute", "prismatic"):',
        wrong='if kind == "prismatic":',
        caught_by=f"{REFUSED}[no limit]",
    ),
    Fault(
        "mimic_dropped_by_the_reader",
        JOINTS,
        right="mimic=None if locked else _read_mimic(element, what, reading)",
        wrong="mimic=None",
        caught_by=f"{READER}::test_everything_that_matters_is_read",
    ),
    Fault(
        "armature_not_read",
        JOINTS,
        right='for attribute in ("damping", "friction", "armature"):',
        wrong='for attribute in ("damping", "friction"):',
        caught_by=f"{READER}::test_everything_that_matters_is_read",
    ),
    Fault(
        "planar_joint_read_as_fixed",
        JOINTS,
        right='"fixed": "fixed",\n}',
        wrong='"fixed": "fixed",\n    "planar": "fixed",\n}',
        caught_by=f"{REFUSALS}::test_joints_of_several_freedoms_are_refused_by_name[planar]",
    ),
    Fault(
        "negative_mass_accepted",
        LINKS,
        right="if mass < 0.0:",
        wrong="if mass < -1e9:",
        caught_by=f"{REFUSED}[negative mass]",
    ),
    Fault(
        "products_of_inertia_dropped",
        LINKS,
        right="for name in _MOMENTS}",
        wrong='for name in ("ixx", "iyy", "izz")}',
        caught_by=f"{READER}::test_everything_that_matters_is_read",
    ),
    Fault(
        "inertial_origin_without_its_attitude",
        LINKS,
        right="Inertial(mass, reading.origin(element, what), **moments",
        wrong="Inertial(mass, type(Inertial().origin)(reading.origin(element, what).xyz), **moments",
        caught_by=f"{READER}::test_everything_that_matters_is_read",
    ),
    Fault(
        "impossible_inertia_not_noted",
        LINKS,
        right="if small + middle < large - rounding:",
        wrong="if small + middle < -large:",
        caught_by=f"{READER}::test_what_could_surprise_is_noted_with_its_line[triangle]",
    ),
    Fault(
        "writer_loses_a_digit",
        WRITER,
        right="return repr(max(-sys.float_info.max, min(sys.float_info.max, float(value))))",
        wrong='return f"{max(-1e308, min(1e308, float(value))):.15g}"',
        caught_by="tests/model/urdf/test_writer.py::test_a_random_model_is_read_back_equal",
    ),
    Fault(
        "package_path_may_lead_out",
        "dynx.model.package_paths",
        right="if not found.is_relative_to(package):",
        wrong="if not found.is_absolute():",
        caught_by="tests/model/test_package_paths.py::test_what_leads_out_or_nowhere_is_refused",
    ),
    Fault(
        "directory_opened_as_a_file",
        "dynx.files.reading",
        right="if stat.S_ISDIR(status.st_mode):",
        wrong="if status.st_size < 0:",
        caught_by="tests/files/test_reading.py::test_a_directory_is_refused",
    ),
)

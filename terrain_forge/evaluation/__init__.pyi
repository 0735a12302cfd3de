"""How well systems localised: trajectories against the truth, as the paper does and others."""

from .alignment import aligned as aligned
from .alignment import associate as associate
from .alignment import rigid_motion as rigid_motion
from .files import read_options as read_options
from .files import score_files as score_files
from .poses import TimedPoses as TimedPoses
from .poses import checked_poses as checked_poses
from .poses import read_poses as read_poses
from .score import Score as Score
from .score import ScoreOptions as ScoreOptions
from .score import Spread as Spread
from .score import relative_errors as relative_errors
from .score import score_poses as score_poses
from .tables import score_lines as score_lines
from .tables import score_plain as score_plain
from .tables import score_rows as score_rows
from .tables import write_scores as write_scores
from .visual_odometry import stereo_odometry as stereo_odometry

from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Source(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    SOURCE_UNKNOWN: _ClassVar[Source]
    SOURCE_HARDWARE: _ClassVar[Source]
    SOURCE_SIMULATED: _ClassVar[Source]
    SOURCE_EMULATED: _ClassVar[Source]
    SOURCE_PLAYED: _ClassVar[Source]
SOURCE_UNKNOWN: Source
SOURCE_HARDWARE: Source
SOURCE_SIMULATED: Source
SOURCE_EMULATED: Source
SOURCE_PLAYED: Source

class Header(_message.Message):
    __slots__ = ("device", "sequence", "epoch", "device_us", "utc_ns", "utc_sigma_s", "source", "run")
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    DEVICE_US_FIELD_NUMBER: _ClassVar[int]
    UTC_NS_FIELD_NUMBER: _ClassVar[int]
    UTC_SIGMA_S_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    RUN_FIELD_NUMBER: _ClassVar[int]
    device: str
    sequence: int
    epoch: int
    device_us: int
    utc_ns: int
    utc_sigma_s: float
    source: Source
    run: int
    def __init__(self, device: _Optional[str] = ..., sequence: _Optional[int] = ..., epoch: _Optional[int] = ..., device_us: _Optional[int] = ..., utc_ns: _Optional[int] = ..., utc_sigma_s: _Optional[float] = ..., source: _Optional[_Union[Source, str]] = ..., run: _Optional[int] = ...) -> None: ...

class AccelBatch(_message.Message):
    __slots__ = ("header", "first_index", "period_s", "axes", "counts", "f_mps2", "stale_mask", "lost_samples", "frame_sequence", "received_ns")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    FIRST_INDEX_FIELD_NUMBER: _ClassVar[int]
    PERIOD_S_FIELD_NUMBER: _ClassVar[int]
    AXES_FIELD_NUMBER: _ClassVar[int]
    COUNTS_FIELD_NUMBER: _ClassVar[int]
    F_MPS2_FIELD_NUMBER: _ClassVar[int]
    STALE_MASK_FIELD_NUMBER: _ClassVar[int]
    LOST_SAMPLES_FIELD_NUMBER: _ClassVar[int]
    FRAME_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    RECEIVED_NS_FIELD_NUMBER: _ClassVar[int]
    header: Header
    first_index: int
    period_s: float
    axes: int
    counts: _containers.RepeatedScalarFieldContainer[int]
    f_mps2: _containers.RepeatedScalarFieldContainer[float]
    stale_mask: int
    lost_samples: int
    frame_sequence: int
    received_ns: int
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., first_index: _Optional[int] = ..., period_s: _Optional[float] = ..., axes: _Optional[int] = ..., counts: _Optional[_Iterable[int]] = ..., f_mps2: _Optional[_Iterable[float]] = ..., stale_mask: _Optional[int] = ..., lost_samples: _Optional[int] = ..., frame_sequence: _Optional[int] = ..., received_ns: _Optional[int] = ...) -> None: ...

class ImuBatch(_message.Message):
    __slots__ = ("header", "first_index", "period_s", "f_b_mps2", "omega_ib_b_radps", "lost_samples", "frame_sequence", "received_ns")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    FIRST_INDEX_FIELD_NUMBER: _ClassVar[int]
    PERIOD_S_FIELD_NUMBER: _ClassVar[int]
    F_B_MPS2_FIELD_NUMBER: _ClassVar[int]
    OMEGA_IB_B_RADPS_FIELD_NUMBER: _ClassVar[int]
    LOST_SAMPLES_FIELD_NUMBER: _ClassVar[int]
    FRAME_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    RECEIVED_NS_FIELD_NUMBER: _ClassVar[int]
    header: Header
    first_index: int
    period_s: float
    f_b_mps2: _containers.RepeatedScalarFieldContainer[float]
    omega_ib_b_radps: _containers.RepeatedScalarFieldContainer[float]
    lost_samples: int
    frame_sequence: int
    received_ns: int
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., first_index: _Optional[int] = ..., period_s: _Optional[float] = ..., f_b_mps2: _Optional[_Iterable[float]] = ..., omega_ib_b_radps: _Optional[_Iterable[float]] = ..., lost_samples: _Optional[int] = ..., frame_sequence: _Optional[int] = ..., received_ns: _Optional[int] = ...) -> None: ...

class TachoRate(_message.Message):
    __slots__ = ("header", "omega_radps", "sigma_radps", "pulses", "direction_known")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    OMEGA_RADPS_FIELD_NUMBER: _ClassVar[int]
    SIGMA_RADPS_FIELD_NUMBER: _ClassVar[int]
    PULSES_FIELD_NUMBER: _ClassVar[int]
    DIRECTION_KNOWN_FIELD_NUMBER: _ClassVar[int]
    header: Header
    omega_radps: float
    sigma_radps: float
    pulses: int
    direction_known: bool
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., omega_radps: _Optional[float] = ..., sigma_radps: _Optional[float] = ..., pulses: _Optional[int] = ..., direction_known: _Optional[bool] = ...) -> None: ...

class GnssFix(_message.Message):
    __slots__ = ("header", "fix_utc_ns", "latitude_deg", "longitude_deg", "height_m", "height_msl_m", "position_sigma_ned_m", "v_n_mps", "velocity_sigma_ned_mps", "quality", "satellites", "hdop", "talker", "device_time_s")
    class Quality(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        QUALITY_NONE: _ClassVar[GnssFix.Quality]
        QUALITY_AUTONOMOUS: _ClassVar[GnssFix.Quality]
        QUALITY_DIFFERENTIAL: _ClassVar[GnssFix.Quality]
        QUALITY_RTK_FLOAT: _ClassVar[GnssFix.Quality]
        QUALITY_RTK_FIXED: _ClassVar[GnssFix.Quality]
        QUALITY_DEAD_RECKONING: _ClassVar[GnssFix.Quality]
    QUALITY_NONE: GnssFix.Quality
    QUALITY_AUTONOMOUS: GnssFix.Quality
    QUALITY_DIFFERENTIAL: GnssFix.Quality
    QUALITY_RTK_FLOAT: GnssFix.Quality
    QUALITY_RTK_FIXED: GnssFix.Quality
    QUALITY_DEAD_RECKONING: GnssFix.Quality
    HEADER_FIELD_NUMBER: _ClassVar[int]
    FIX_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    LATITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    LONGITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_MSL_M_FIELD_NUMBER: _ClassVar[int]
    POSITION_SIGMA_NED_M_FIELD_NUMBER: _ClassVar[int]
    V_N_MPS_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_SIGMA_NED_MPS_FIELD_NUMBER: _ClassVar[int]
    QUALITY_FIELD_NUMBER: _ClassVar[int]
    SATELLITES_FIELD_NUMBER: _ClassVar[int]
    HDOP_FIELD_NUMBER: _ClassVar[int]
    TALKER_FIELD_NUMBER: _ClassVar[int]
    DEVICE_TIME_S_FIELD_NUMBER: _ClassVar[int]
    header: Header
    fix_utc_ns: int
    latitude_deg: float
    longitude_deg: float
    height_m: float
    height_msl_m: float
    position_sigma_ned_m: _containers.RepeatedScalarFieldContainer[float]
    v_n_mps: _containers.RepeatedScalarFieldContainer[float]
    velocity_sigma_ned_mps: _containers.RepeatedScalarFieldContainer[float]
    quality: GnssFix.Quality
    satellites: int
    hdop: float
    talker: str
    device_time_s: float
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., fix_utc_ns: _Optional[int] = ..., latitude_deg: _Optional[float] = ..., longitude_deg: _Optional[float] = ..., height_m: _Optional[float] = ..., height_msl_m: _Optional[float] = ..., position_sigma_ned_m: _Optional[_Iterable[float]] = ..., v_n_mps: _Optional[_Iterable[float]] = ..., velocity_sigma_ned_mps: _Optional[_Iterable[float]] = ..., quality: _Optional[_Union[GnssFix.Quality, str]] = ..., satellites: _Optional[int] = ..., hdop: _Optional[float] = ..., talker: _Optional[str] = ..., device_time_s: _Optional[float] = ...) -> None: ...

class LinkStatus(_message.Message):
    __slots__ = ("header", "connected", "port", "message", "bytes_in", "good_frames", "good_bytes", "bad_chunks", "bad_bytes", "pending_bytes", "lost_frames", "device_dropped", "lost_samples", "reboots", "unknown_frames", "reconnects", "sample_rate_hz", "frame_rate_hz", "latency_p50_s", "latency_p99_s", "clock_skew_ppm", "clock_residual_s", "clock_window_s", "journal_sequence", "durable_sequence", "gnss_good", "gnss_bad", "damage")
    class DamageEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    CONNECTED_FIELD_NUMBER: _ClassVar[int]
    PORT_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    BYTES_IN_FIELD_NUMBER: _ClassVar[int]
    GOOD_FRAMES_FIELD_NUMBER: _ClassVar[int]
    GOOD_BYTES_FIELD_NUMBER: _ClassVar[int]
    BAD_CHUNKS_FIELD_NUMBER: _ClassVar[int]
    BAD_BYTES_FIELD_NUMBER: _ClassVar[int]
    PENDING_BYTES_FIELD_NUMBER: _ClassVar[int]
    LOST_FRAMES_FIELD_NUMBER: _ClassVar[int]
    DEVICE_DROPPED_FIELD_NUMBER: _ClassVar[int]
    LOST_SAMPLES_FIELD_NUMBER: _ClassVar[int]
    REBOOTS_FIELD_NUMBER: _ClassVar[int]
    UNKNOWN_FRAMES_FIELD_NUMBER: _ClassVar[int]
    RECONNECTS_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    FRAME_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    LATENCY_P50_S_FIELD_NUMBER: _ClassVar[int]
    LATENCY_P99_S_FIELD_NUMBER: _ClassVar[int]
    CLOCK_SKEW_PPM_FIELD_NUMBER: _ClassVar[int]
    CLOCK_RESIDUAL_S_FIELD_NUMBER: _ClassVar[int]
    CLOCK_WINDOW_S_FIELD_NUMBER: _ClassVar[int]
    JOURNAL_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    DURABLE_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    GNSS_GOOD_FIELD_NUMBER: _ClassVar[int]
    GNSS_BAD_FIELD_NUMBER: _ClassVar[int]
    DAMAGE_FIELD_NUMBER: _ClassVar[int]
    header: Header
    connected: bool
    port: str
    message: str
    bytes_in: int
    good_frames: int
    good_bytes: int
    bad_chunks: int
    bad_bytes: int
    pending_bytes: int
    lost_frames: int
    device_dropped: int
    lost_samples: int
    reboots: int
    unknown_frames: int
    reconnects: int
    sample_rate_hz: float
    frame_rate_hz: float
    latency_p50_s: float
    latency_p99_s: float
    clock_skew_ppm: float
    clock_residual_s: float
    clock_window_s: float
    journal_sequence: int
    durable_sequence: int
    gnss_good: int
    gnss_bad: int
    damage: _containers.ScalarMap[str, int]
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., connected: _Optional[bool] = ..., port: _Optional[str] = ..., message: _Optional[str] = ..., bytes_in: _Optional[int] = ..., good_frames: _Optional[int] = ..., good_bytes: _Optional[int] = ..., bad_chunks: _Optional[int] = ..., bad_bytes: _Optional[int] = ..., pending_bytes: _Optional[int] = ..., lost_frames: _Optional[int] = ..., device_dropped: _Optional[int] = ..., lost_samples: _Optional[int] = ..., reboots: _Optional[int] = ..., unknown_frames: _Optional[int] = ..., reconnects: _Optional[int] = ..., sample_rate_hz: _Optional[float] = ..., frame_rate_hz: _Optional[float] = ..., latency_p50_s: _Optional[float] = ..., latency_p99_s: _Optional[float] = ..., clock_skew_ppm: _Optional[float] = ..., clock_residual_s: _Optional[float] = ..., clock_window_s: _Optional[float] = ..., journal_sequence: _Optional[int] = ..., durable_sequence: _Optional[int] = ..., gnss_good: _Optional[int] = ..., gnss_bad: _Optional[int] = ..., damage: _Optional[_Mapping[str, int]] = ...) -> None: ...

class BoardInfo(_message.Message):
    __slots__ = ("header", "board_id", "uid", "firmware", "axes", "sample_period_s", "status")
    class StatusEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    BOARD_ID_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    FIRMWARE_FIELD_NUMBER: _ClassVar[int]
    AXES_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_PERIOD_S_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    header: Header
    board_id: int
    uid: str
    firmware: str
    axes: int
    sample_period_s: float
    status: _containers.ScalarMap[str, int]
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., board_id: _Optional[int] = ..., uid: _Optional[str] = ..., firmware: _Optional[str] = ..., axes: _Optional[int] = ..., sample_period_s: _Optional[float] = ..., status: _Optional[_Mapping[str, int]] = ...) -> None: ...

class RateEstimate(_message.Message):
    __slots__ = ("header", "estimator", "for_sequence", "for_index", "omega_ib_b_radps", "omega_covariance", "alpha_b_radps2", "f_b_mps2", "q_nb", "angle_z_rad", "innovation", "innovation_sigma", "nis", "nis_dof", "still", "p_n_m", "v_n_mps", "bias", "innovation_unit")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ESTIMATOR_FIELD_NUMBER: _ClassVar[int]
    FOR_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    FOR_INDEX_FIELD_NUMBER: _ClassVar[int]
    OMEGA_IB_B_RADPS_FIELD_NUMBER: _ClassVar[int]
    OMEGA_COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    ALPHA_B_RADPS2_FIELD_NUMBER: _ClassVar[int]
    F_B_MPS2_FIELD_NUMBER: _ClassVar[int]
    Q_NB_FIELD_NUMBER: _ClassVar[int]
    ANGLE_Z_RAD_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_SIGMA_FIELD_NUMBER: _ClassVar[int]
    NIS_FIELD_NUMBER: _ClassVar[int]
    NIS_DOF_FIELD_NUMBER: _ClassVar[int]
    STILL_FIELD_NUMBER: _ClassVar[int]
    P_N_M_FIELD_NUMBER: _ClassVar[int]
    V_N_MPS_FIELD_NUMBER: _ClassVar[int]
    BIAS_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_UNIT_FIELD_NUMBER: _ClassVar[int]
    header: Header
    estimator: str
    for_sequence: int
    for_index: int
    omega_ib_b_radps: _containers.RepeatedScalarFieldContainer[float]
    omega_covariance: _containers.RepeatedScalarFieldContainer[float]
    alpha_b_radps2: _containers.RepeatedScalarFieldContainer[float]
    f_b_mps2: _containers.RepeatedScalarFieldContainer[float]
    q_nb: _containers.RepeatedScalarFieldContainer[float]
    angle_z_rad: float
    innovation: _containers.RepeatedScalarFieldContainer[float]
    innovation_sigma: _containers.RepeatedScalarFieldContainer[float]
    nis: float
    nis_dof: int
    still: bool
    p_n_m: _containers.RepeatedScalarFieldContainer[float]
    v_n_mps: _containers.RepeatedScalarFieldContainer[float]
    bias: _containers.RepeatedScalarFieldContainer[float]
    innovation_unit: str
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., estimator: _Optional[str] = ..., for_sequence: _Optional[int] = ..., for_index: _Optional[int] = ..., omega_ib_b_radps: _Optional[_Iterable[float]] = ..., omega_covariance: _Optional[_Iterable[float]] = ..., alpha_b_radps2: _Optional[_Iterable[float]] = ..., f_b_mps2: _Optional[_Iterable[float]] = ..., q_nb: _Optional[_Iterable[float]] = ..., angle_z_rad: _Optional[float] = ..., innovation: _Optional[_Iterable[float]] = ..., innovation_sigma: _Optional[_Iterable[float]] = ..., nis: _Optional[float] = ..., nis_dof: _Optional[int] = ..., still: _Optional[bool] = ..., p_n_m: _Optional[_Iterable[float]] = ..., v_n_mps: _Optional[_Iterable[float]] = ..., bias: _Optional[_Iterable[float]] = ..., innovation_unit: _Optional[str] = ...) -> None: ...

class NavSolution(_message.Message):
    __slots__ = ("header", "estimator", "for_sequence", "for_index", "mode", "latitude_deg", "longitude_deg", "height_m", "p_ned_m", "v_n_mps", "q_nb", "bias_f_b_mps2", "bias_omega_b_radps", "sigma", "position_covariance", "origin_latitude_deg", "origin_longitude_deg", "origin_height_m", "fix_age_s")
    class Mode(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        MODE_WAITING: _ClassVar[NavSolution.Mode]
        MODE_LEVELLING: _ClassVar[NavSolution.Mode]
        MODE_COURSE: _ClassVar[NavSolution.Mode]
        MODE_NAVIGATING: _ClassVar[NavSolution.Mode]
    MODE_WAITING: NavSolution.Mode
    MODE_LEVELLING: NavSolution.Mode
    MODE_COURSE: NavSolution.Mode
    MODE_NAVIGATING: NavSolution.Mode
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ESTIMATOR_FIELD_NUMBER: _ClassVar[int]
    FOR_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    FOR_INDEX_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    LATITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    LONGITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    P_NED_M_FIELD_NUMBER: _ClassVar[int]
    V_N_MPS_FIELD_NUMBER: _ClassVar[int]
    Q_NB_FIELD_NUMBER: _ClassVar[int]
    BIAS_F_B_MPS2_FIELD_NUMBER: _ClassVar[int]
    BIAS_OMEGA_B_RADPS_FIELD_NUMBER: _ClassVar[int]
    SIGMA_FIELD_NUMBER: _ClassVar[int]
    POSITION_COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_LATITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_LONGITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    FIX_AGE_S_FIELD_NUMBER: _ClassVar[int]
    header: Header
    estimator: str
    for_sequence: int
    for_index: int
    mode: NavSolution.Mode
    latitude_deg: float
    longitude_deg: float
    height_m: float
    p_ned_m: _containers.RepeatedScalarFieldContainer[float]
    v_n_mps: _containers.RepeatedScalarFieldContainer[float]
    q_nb: _containers.RepeatedScalarFieldContainer[float]
    bias_f_b_mps2: _containers.RepeatedScalarFieldContainer[float]
    bias_omega_b_radps: _containers.RepeatedScalarFieldContainer[float]
    sigma: _containers.RepeatedScalarFieldContainer[float]
    position_covariance: _containers.RepeatedScalarFieldContainer[float]
    origin_latitude_deg: float
    origin_longitude_deg: float
    origin_height_m: float
    fix_age_s: float
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., estimator: _Optional[str] = ..., for_sequence: _Optional[int] = ..., for_index: _Optional[int] = ..., mode: _Optional[_Union[NavSolution.Mode, str]] = ..., latitude_deg: _Optional[float] = ..., longitude_deg: _Optional[float] = ..., height_m: _Optional[float] = ..., p_ned_m: _Optional[_Iterable[float]] = ..., v_n_mps: _Optional[_Iterable[float]] = ..., q_nb: _Optional[_Iterable[float]] = ..., bias_f_b_mps2: _Optional[_Iterable[float]] = ..., bias_omega_b_radps: _Optional[_Iterable[float]] = ..., sigma: _Optional[_Iterable[float]] = ..., position_covariance: _Optional[_Iterable[float]] = ..., origin_latitude_deg: _Optional[float] = ..., origin_longitude_deg: _Optional[float] = ..., origin_height_m: _Optional[float] = ..., fix_age_s: _Optional[float] = ...) -> None: ...

class Innovation(_message.Message):
    __slots__ = ("header", "estimator", "for_sequence", "name", "value", "sigma", "nis", "dof", "accepted", "error_to_reference")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ESTIMATOR_FIELD_NUMBER: _ClassVar[int]
    FOR_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    SIGMA_FIELD_NUMBER: _ClassVar[int]
    NIS_FIELD_NUMBER: _ClassVar[int]
    DOF_FIELD_NUMBER: _ClassVar[int]
    ACCEPTED_FIELD_NUMBER: _ClassVar[int]
    ERROR_TO_REFERENCE_FIELD_NUMBER: _ClassVar[int]
    header: Header
    estimator: str
    for_sequence: int
    name: _containers.RepeatedScalarFieldContainer[str]
    value: _containers.RepeatedScalarFieldContainer[float]
    sigma: _containers.RepeatedScalarFieldContainer[float]
    nis: float
    dof: int
    accepted: bool
    error_to_reference: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., estimator: _Optional[str] = ..., for_sequence: _Optional[int] = ..., name: _Optional[_Iterable[str]] = ..., value: _Optional[_Iterable[float]] = ..., sigma: _Optional[_Iterable[float]] = ..., nis: _Optional[float] = ..., dof: _Optional[int] = ..., accepted: _Optional[bool] = ..., error_to_reference: _Optional[_Iterable[float]] = ...) -> None: ...

class Truth(_message.Message):
    __slots__ = ("header", "for_index", "q_nb", "omega_ib_b_radps", "alpha_b_radps2", "f_b_mps2", "angle_z_rad", "profile_time_s")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    FOR_INDEX_FIELD_NUMBER: _ClassVar[int]
    Q_NB_FIELD_NUMBER: _ClassVar[int]
    OMEGA_IB_B_RADPS_FIELD_NUMBER: _ClassVar[int]
    ALPHA_B_RADPS2_FIELD_NUMBER: _ClassVar[int]
    F_B_MPS2_FIELD_NUMBER: _ClassVar[int]
    ANGLE_Z_RAD_FIELD_NUMBER: _ClassVar[int]
    PROFILE_TIME_S_FIELD_NUMBER: _ClassVar[int]
    header: Header
    for_index: int
    q_nb: _containers.RepeatedScalarFieldContainer[float]
    omega_ib_b_radps: _containers.RepeatedScalarFieldContainer[float]
    alpha_b_radps2: _containers.RepeatedScalarFieldContainer[float]
    f_b_mps2: _containers.RepeatedScalarFieldContainer[float]
    angle_z_rad: float
    profile_time_s: float
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., for_index: _Optional[int] = ..., q_nb: _Optional[_Iterable[float]] = ..., omega_ib_b_radps: _Optional[_Iterable[float]] = ..., alpha_b_radps2: _Optional[_Iterable[float]] = ..., f_b_mps2: _Optional[_Iterable[float]] = ..., angle_z_rad: _Optional[float] = ..., profile_time_s: _Optional[float] = ...) -> None: ...

class EstimatorStatus(_message.Message):
    __slots__ = ("header", "estimator", "samples", "gaps", "missing_samples", "us_per_sample", "state", "message", "bias_f_b_mps2", "bias_alpha_radps2", "layout", "version", "restart")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ESTIMATOR_FIELD_NUMBER: _ClassVar[int]
    SAMPLES_FIELD_NUMBER: _ClassVar[int]
    GAPS_FIELD_NUMBER: _ClassVar[int]
    MISSING_SAMPLES_FIELD_NUMBER: _ClassVar[int]
    US_PER_SAMPLE_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    BIAS_F_B_MPS2_FIELD_NUMBER: _ClassVar[int]
    BIAS_ALPHA_RADPS2_FIELD_NUMBER: _ClassVar[int]
    LAYOUT_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    RESTART_FIELD_NUMBER: _ClassVar[int]
    header: Header
    estimator: str
    samples: int
    gaps: int
    missing_samples: int
    us_per_sample: float
    state: str
    message: str
    bias_f_b_mps2: _containers.RepeatedScalarFieldContainer[float]
    bias_alpha_radps2: _containers.RepeatedScalarFieldContainer[float]
    layout: str
    version: str
    restart: bytes
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., estimator: _Optional[str] = ..., samples: _Optional[int] = ..., gaps: _Optional[int] = ..., missing_samples: _Optional[int] = ..., us_per_sample: _Optional[float] = ..., state: _Optional[str] = ..., message: _Optional[str] = ..., bias_f_b_mps2: _Optional[_Iterable[float]] = ..., bias_alpha_radps2: _Optional[_Iterable[float]] = ..., layout: _Optional[str] = ..., version: _Optional[str] = ..., restart: _Optional[bytes] = ...) -> None: ...

class RecorderCommand(_message.Message):
    __slots__ = ("action", "name", "note", "user")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_STATUS: _ClassVar[RecorderCommand.Action]
        ACTION_START: _ClassVar[RecorderCommand.Action]
        ACTION_STOP: _ClassVar[RecorderCommand.Action]
    ACTION_STATUS: RecorderCommand.Action
    ACTION_START: RecorderCommand.Action
    ACTION_STOP: RecorderCommand.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    NOTE_FIELD_NUMBER: _ClassVar[int]
    USER_FIELD_NUMBER: _ClassVar[int]
    action: RecorderCommand.Action
    name: str
    note: str
    user: str
    def __init__(self, action: _Optional[_Union[RecorderCommand.Action, str]] = ..., name: _Optional[str] = ..., note: _Optional[str] = ..., user: _Optional[str] = ...) -> None: ...

class RecorderStatus(_message.Message):
    __slots__ = ("header", "recording", "session", "seconds", "messages", "bytes", "durable_messages", "message", "lost")
    class LostEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    RECORDING_FIELD_NUMBER: _ClassVar[int]
    SESSION_FIELD_NUMBER: _ClassVar[int]
    SECONDS_FIELD_NUMBER: _ClassVar[int]
    MESSAGES_FIELD_NUMBER: _ClassVar[int]
    BYTES_FIELD_NUMBER: _ClassVar[int]
    DURABLE_MESSAGES_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    header: Header
    recording: bool
    session: str
    seconds: float
    messages: int
    bytes: int
    durable_messages: int
    message: str
    lost: _containers.ScalarMap[str, int]
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., recording: _Optional[bool] = ..., session: _Optional[str] = ..., seconds: _Optional[float] = ..., messages: _Optional[int] = ..., bytes: _Optional[int] = ..., durable_messages: _Optional[int] = ..., message: _Optional[str] = ..., lost: _Optional[_Mapping[str, int]] = ...) -> None: ...

BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0001');
CREATE TABLE artefacts (
	job_id VARCHAR(32) NOT NULL, 
	name VARCHAR(64) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_artefacts PRIMARY KEY (job_id, name), 
	CONSTRAINT fk_artefacts_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "artefacts" VALUES('d4e55213dc35454aacaf7cbd4125d5f0','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
INSERT INTO "artefacts" VALUES('84ae669ff7c3453f80c91a293de73e03','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
CREATE TABLE datasets (
	owner VARCHAR(64) NOT NULL, 
	id VARCHAR(48) NOT NULL, 
	name VARCHAR(255) NOT NULL, 
	suffix VARCHAR(16) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	bytes BIGINT NOT NULL, 
	preview TEXT NOT NULL, 
	created FLOAT NOT NULL, 
	CONSTRAINT pk_datasets PRIMARY KEY (owner, id)
);
INSERT INTO "datasets" VALUES('alice','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb-csv','Bühne.csv','.csv','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb',12,'{"columns": [{"name": "u", "unit": "\u00b5m"}]}',1.79518591989900016788e+09);
CREATE TABLE events (
	job_id VARCHAR(32) NOT NULL, 
	number BIGINT NOT NULL, 
	kind VARCHAR(16) NOT NULL, 
	data TEXT NOT NULL, 
	at FLOAT NOT NULL, 
	CONSTRAINT pk_events PRIMARY KEY (job_id, number), 
	CONSTRAINT fk_events_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "events" VALUES('d4e55213dc35454aacaf7cbd4125d5f0',1,'queued','{}',1.79518591990600085263e+09);
INSERT INTO "events" VALUES('d4e55213dc35454aacaf7cbd4125d5f0',2,'running','{"attempt": 1}',1.79518592000799179081e+09);
INSERT INTO "events" VALUES('d4e55213dc35454aacaf7cbd4125d5f0',3,'progress','{"generation": 3}',1.79518592001499223713e+09);
INSERT INTO "events" VALUES('d4e55213dc35454aacaf7cbd4125d5f0',4,'succeeded','{"best": 0.5}',1.79518592002698183056e+09);
INSERT INTO "events" VALUES('84ae669ff7c3453f80c91a293de73e03',1,'queued','{}',1.79518592005200672149e+09);
INSERT INTO "events" VALUES('84ae669ff7c3453f80c91a293de73e03',2,'running','{"attempt": 1}',1.79518592006198453902e+09);
INSERT INTO "events" VALUES('84ae669ff7c3453f80c91a293de73e03',3,'progress','{"generation": 3}',1.7951859200740144253e+09);
INSERT INTO "events" VALUES('84ae669ff7c3453f80c91a293de73e03',4,'failed','{"type": "broken", "detail": "it broke"}',1.79518592010201668736e+09);
INSERT INTO "events" VALUES('1613468eb5014d1dac386098fa98de74',1,'queued','{}',1.79518592011400604253e+09);
INSERT INTO "events" VALUES('1613468eb5014d1dac386098fa98de74',2,'cancelled','{}',1.7951859201200008392e+09);
INSERT INTO "events" VALUES('3116d0ed24c347e78c6e11ca803d9116',1,'queued','{}',1.79518592013001894946e+09);
INSERT INTO "events" VALUES('3116d0ed24c347e78c6e11ca803d9116',2,'running','{"attempt": 1}',1.79518592013899087912e+09);
INSERT INTO "events" VALUES('3116d0ed24c347e78c6e11ca803d9116',3,'progress','{"generation": 5}',1.79518592015001487733e+09);
INSERT INTO "events" VALUES('5eae34a79f7d459ba118898136ee7153',1,'queued','{}',1.79518592015500354761e+09);
CREATE TABLE jobs (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	kind VARCHAR(32) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	spec TEXT NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255), 
	priority INTEGER NOT NULL, 
	state VARCHAR(16) NOT NULL, 
	version BIGINT NOT NULL, 
	attempt INTEGER NOT NULL, 
	stalled INTEGER NOT NULL, 
	lease_owner VARCHAR(128), 
	lease_epoch BIGINT NOT NULL, 
	lease_until FLOAT NOT NULL, 
	cancel_requested BOOLEAN NOT NULL, 
	progress TEXT, 
	checkpoint VARCHAR(64), 
	summary TEXT, 
	problem TEXT, 
	created FLOAT NOT NULL, 
	updated FLOAT NOT NULL, 
	started FLOAT, 
	finished FLOAT, 
	CONSTRAINT pk_jobs PRIMARY KEY (id), 
	CONSTRAINT uq_jobs_owner_idempotency_key UNIQUE (owner, idempotency_key)
);
INSERT INTO "jobs" VALUES('d4e55213dc35454aacaf7cbd4125d5f0','alice','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'succeeded',4,1,1,NULL,1,1.79518952000799179077e+09,0,'{"generation": 3}',NULL,'{"best": 0.5}',NULL,1.79518591990600085263e+09,1.79518592002698183056e+09,1.79518592000799179081e+09,1.79518592002698183056e+09);
INSERT INTO "jobs" VALUES('84ae669ff7c3453f80c91a293de73e03','bob','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'failed',4,1,1,NULL,1,1.79518952006198453897e+09,0,'{"generation": 3}',NULL,NULL,'{"type": "broken", "detail": "it broke"}',1.79518592005200672149e+09,1.79518592010201668736e+09,1.79518592006198453902e+09,1.79518592010201668736e+09);
INSERT INTO "jobs" VALUES('1613468eb5014d1dac386098fa98de74','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79518592011400604253e+09,1.7951859201200008392e+09,NULL,1.7951859201200008392e+09);
INSERT INTO "jobs" VALUES('3116d0ed24c347e78c6e11ca803d9116','alice','identification','','{"seed": 7}','f6c5bcd3d909a363e7a7587adacef58b627c60d8739426f43be90f2151397148',NULL,-7,'running',3,1,1,'5d76bde5f5464e598e588e92744ae038',1,1.79518952013899087908e+09,0,'{"generation": 5}',NULL,NULL,NULL,1.79518592013001894946e+09,1.79518592015001487733e+09,1.79518592013899087912e+09,NULL);
INSERT INTO "jobs" VALUES('5eae34a79f7d459ba118898136ee7153','bob','identification','','{"value": 0.30000000000000004}','82373462d26bbbd3624b2132ac4a1e2dda7aa144af0f8d5c98cab00845edf90d',NULL,100,'queued',1,0,0,NULL,0,0.0,0,NULL,NULL,NULL,NULL,1.79518592015500354761e+09,1.79518592015500354761e+09,NULL,NULL);
CREATE TABLE keys (
	id VARCHAR(16) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	secret_sha256 VARCHAR(64) NOT NULL, 
	scopes TEXT NOT NULL, 
	created FLOAT NOT NULL, 
	expires FLOAT, 
	revoked FLOAT, 
	CONSTRAINT pk_keys PRIMARY KEY (id), 
	CONSTRAINT uq_keys_secret_sha256 UNIQUE (secret_sha256)
);
INSERT INTO "keys" VALUES('be4696a56b9537ba','alice','revoked','3cc458b4e4e5a6e27a4a6dfcafbd5daa6e8f64094ec403bc6bcb7727748cc3d6','["read", "write"]',1.79518591980899858478e+09,1.79518951980899858474e+09,1795185919.86098);
CREATE TABLE models (
	job_id VARCHAR(32) NOT NULL, 
	rank INTEGER NOT NULL, 
	document TEXT NOT NULL, 
	file TEXT NOT NULL, 
	CONSTRAINT pk_models PRIMARY KEY (job_id, rank), 
	CONSTRAINT fk_models_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "models" VALUES('d4e55213dc35454aacaf7cbd4125d5f0',1,'{"fitness": 0.5}','first');
INSERT INTO "models" VALUES('d4e55213dc35454aacaf7cbd4125d5f0',2,'{"fitness": 0.7}','second');
CREATE TABLE points (
	job_id VARCHAR(32) NOT NULL, 
	generation INTEGER NOT NULL, 
	evaluations BIGINT NOT NULL, 
	best TEXT NOT NULL, 
	islands TEXT NOT NULL, 
	CONSTRAINT pk_points PRIMARY KEY (job_id, generation), 
	CONSTRAINT fk_points_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "points" VALUES('d4e55213dc35454aacaf7cbd4125d5f0',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('84ae669ff7c3453f80c91a293de73e03',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('3116d0ed24c347e78c6e11ca803d9116',5,50,'{"3": 0.16666666666666666}','[0.5, null]');
CREATE TABLE results (
	job_id VARCHAR(32) NOT NULL, 
	document TEXT NOT NULL, 
	CONSTRAINT pk_results PRIMARY KEY (job_id), 
	CONSTRAINT fk_results_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "results" VALUES('d4e55213dc35454aacaf7cbd4125d5f0','{"search": {"seed": 7}}');
CREATE INDEX ix_jobs_state_priority_created ON jobs (state, priority, created);
CREATE INDEX ix_jobs_owner_created_id ON jobs (owner, created, id);
CREATE INDEX ix_jobs_owner_state_created_id ON jobs (owner, state, created, id);
COMMIT;
